"""A node of ROS 2 without an installation of ROS: the wire of rmw_zenoh over a session of Zenoh.

In: messages of topics. Out: calls of a CommandSink; the face, its joints, frames and diagnostics as messages.
Imports base to links.line, and the joints of heads; Zenoh and rosbags are the extra ros2.
"""
