"""The lifecycle node, configured and activated: `ros2 launch armload_ros payload.launch.py robot:=panda`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition


def generate_launch_description():
    """One node in a namespace; several arms are several launches."""
    default = PathJoinSubstitution([FindPackageShare("armload_ros"), "config", "payload.yaml"])
    node = LifecycleNode(
        package="armload_ros",
        executable="payload_identifier",
        name="payload_identifier",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params"),
            {"robot": LaunchConfiguration("robot"), "use_sim_time": LaunchConfiguration("use_sim_time")},
        ],
        remappings=[("joint_states", LaunchConfiguration("joint_states"))],
        output="screen",
    )

    def change(transition):
        return EmitEvent(event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition))

    activate = OnStateTransition(
        target_lifecycle_node=node, goal_state="inactive", entities=[change(Transition.TRANSITION_ACTIVATE)]
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("robot", default_value="panda", description="a built-in arm, or the path of a URDF"),
            DeclareLaunchArgument("namespace", default_value="", description="of the node, one for each arm"),
            DeclareLaunchArgument(
                "joint_states", default_value="joint_states", description="topic of the joint states"
            ),
            DeclareLaunchArgument("params", default_value=default, description="YAML file of parameters"),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="whether /clock tells the time"),
            node,
            RegisterEventHandler(activate),
            change(Transition.TRANSITION_CONFIGURE),
        ]
    )
