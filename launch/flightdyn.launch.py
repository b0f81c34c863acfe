"""Start the planner and the simulator, on their own or in a demo.

ros2 launch flightdyn flightdyn.launch.py demo:=glide viewer:=rerun+http://127.0.0.1:9876/proxy
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Return the launch description."""
    config = [FindPackageShare('flightdyn'), 'config']

    def text(name):
        # Without a type, a path such as `1` or `on` would arrive as a number or a bool.
        return ParameterValue(LaunchConfiguration(name), value_type=str)

    def parameters(name):
        """Return the files of a node; what comes later prevails."""
        demo = PythonExpression(["'", LaunchConfiguration('demo'), ".yaml'"])
        return [
            PathJoinSubstitution([*config, f'{name}.yaml']),
            PathJoinSubstitution([*config, 'demos', demo]),
            LaunchConfiguration('params_file'),
        ]

    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of both nodes'
            ),
            DeclareLaunchArgument(
                'demo',
                default_value='none',
                choices=['none', 'glide', 'flip'],
                description='what is flown at once, see config/demos',
            ),
            DeclareLaunchArgument(
                'params_file',
                default_value=PathJoinSubstitution([*config, 'demos', 'none.yaml']),
                description='parameters of your own for both nodes; they prevail',
            ),
            DeclareLaunchArgument(
                'config_dir',
                default_value='',
                description='folder with vehicles/, problems/ and scenarios/ of your own',
            ),
            DeclareLaunchArgument(
                'viewer', default_value='', description='rerun viewer to show both in'
            ),
            DeclareLaunchArgument(
                'record', default_value='', description='recording to write; empty for none'
            ),
            Node(
                package='flightdyn',
                executable='planner',
                name='planner',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    *parameters('planner'),
                    {'config_dir': text('config_dir'), 'viewer': text('viewer')},
                ],
                output='screen',
            ),
            Node(
                package='flightdyn',
                executable='sim',
                name='sim',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    *parameters('sim'),
                    {
                        'config_dir': text('config_dir'),
                        'viewer': text('viewer'),
                        'record': text('record'),
                    },
                ],
                output='screen',
            ),
            ExecuteProcess(
                condition=IfCondition(
                    PythonExpression(["'", LaunchConfiguration('demo'), "' == 'flip'"])
                ),
                cmd=[
                    'ros2',
                    'action',
                    'send_goal',
                    [LaunchConfiguration('namespace'), '/planner/plan_trajectory'],
                    'flightdyn_msgs/action/PlanTrajectory',
                    '{problem: quadcopter_flip}',
                ],
                output='screen',
            ),
        ]
    )
