"""Play a flight log."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Return the launch description."""

    def typed(name, value_type):
        return ParameterValue(LaunchConfiguration(name), value_type=value_type)

    return LaunchDescription(
        [
            DeclareLaunchArgument('log', description='flight log to play'),
            DeclareLaunchArgument('namespace', default_value='', description='of the node'),
            DeclareLaunchArgument(
                'rate', default_value='1.0', description='log time over wall time'
            ),
            DeclareLaunchArgument(
                'loop', default_value='false', description='start again at the end'
            ),
            Node(
                package='flightdyn',
                executable='replay',
                name='replay',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    PathJoinSubstitution([FindPackageShare('flightdyn'), 'config', 'replay.yaml']),
                    {
                        'log': typed('log', str),
                        'rate': typed('rate', float),
                        'loop': typed('loop', bool),
                    },
                ],
                output='screen',
            ),
        ]
    )
