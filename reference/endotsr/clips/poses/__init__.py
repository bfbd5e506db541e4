"""Camera poses of a clip with depth: estimation, and the check of given ones.

In: pictures, masks and depth of the frames, and the intrinsics (`Views`). Out: one pose for each frame, or a verdict on
given poses. This room knows no file. Depth is held fixed, and the first pose is the identity.
"""
