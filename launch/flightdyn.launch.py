"""Start the planner and the simulator."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Return the launch description."""

    def text(name):
        # Without a type, a path such as `1` or `on` would arrive as a number or a bool.
        return ParameterValue(LaunchConfiguration(name), value_type=str)

    def parameters(name):
        return PathJoinSubstitution([FindPackageShare('flightdyn'), 'config', f'{name}.yaml'])

    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of both nodes'
            ),
            DeclareLaunchArgument(
                'config_dir',
                default_value='',
                description='folder with vehicles/, problems/ and scenarios/ of your own',
            ),
            DeclareLaunchArgument(
                'record', default_value='', description='recording to write; empty for none'
            ),
            Node(
                package='flightdyn',
                executable='planner',
                name='planner',
                namespace=LaunchConfiguration('namespace'),
                parameters=[parameters('planner'), {'config_dir': text('config_dir')}],
                output='screen',
            ),
            Node(
                package='flightdyn',
                executable='sim',
                name='sim',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    parameters('sim'),
                    {'config_dir': text('config_dir'), 'record': text('record')},
                ],
                output='screen',
            ),
        ]
    )
