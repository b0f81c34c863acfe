"""Play a flight log.

ros2 launch flightdyn replay.launch.py log:=/path/to/flight.mcap start_at:=takeoff rate:=4
"""

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
            DeclareLaunchArgument(
                'log_root',
                default_value='',
                description='the only folder from which logs are opened; empty for that of log',
            ),
            DeclareLaunchArgument(
                'source',
                default_value='',
                description='topic to take positions from; empty for the best there is',
            ),
            DeclareLaunchArgument(
                'start_at',
                default_value='',
                description='moment to begin at: 90, takeoff+10, 2024-06-01T12:30:00Z',
            ),
            DeclareLaunchArgument(
                'rate',
                default_value='1.0',
                description='log time over wall time; below 0 it plays backwards',
            ),
            DeclareLaunchArgument(
                'loop', default_value='false', description='start again at the end'
            ),
            DeclareLaunchArgument('paused', default_value='false', description='start paused'),
            DeclareLaunchArgument(
                'viewer', default_value='', description='rerun viewer to show the flight in'
            ),
            DeclareLaunchArgument('namespace', default_value='', description='of the node'),
            DeclareLaunchArgument(
                'params_file',
                default_value=PathJoinSubstitution(
                    [FindPackageShare('flightdyn'), 'config', 'replay.yaml']
                ),
                description='parameters of your own; the arguments above prevail',
            ),
            Node(
                package='flightdyn',
                executable='replay',
                name='replay',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    LaunchConfiguration('params_file'),
                    {
                        'log': typed('log', str),
                        'log_root': typed('log_root', str),
                        'source': typed('source', str),
                        'start_at': typed('start_at', str),
                        'rate': typed('rate', float),
                        'loop': typed('loop', bool),
                        'paused': typed('paused', bool),
                        'viewer': typed('viewer', str),
                    },
                ],
                output='screen',
            ),
        ]
    )
