"""A node of ROS 2 without an installation of ROS: the wire of rmw_zenoh over a session of Zenoh.

In: messages of topics. Out: calls of a CommandSink; the face, its joints, frames and diagnostics as messages. Imports
base, vocabulary, formats, layers, other links, and the joints of heads; Zenoh and rosbags, the extra ros2.
"""
