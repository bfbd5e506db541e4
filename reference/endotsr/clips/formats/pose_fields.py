"""The fields of poses_bounds.npy (LLFF) and of COLMAP's models; see `inventory`.

Both have no names in the file: a field is a place in a row or a line. A row or line of another length is refused.
"""

from endotsr.clips.formats.inventory import Inventory

LLFF = Inventory(
    "a row of poses_bounds.npy of LLFF: R t (H W f), near far",
    used={
        "R": "rotation, camera-to-world; axes right, up, backward, or those of --trajectory-axes",
        "t": "position of the camera, millimetres or --trajectory-unit",
        "H W": "size of the pictures, which have to have it",
        "f": "focal length, pixels",
    },
    harmless={"near far": "bounds of the samples along a ray in another program; the scene begins with its depth"},
)
COLMAP_CAMERA = Inventory(
    "a camera of COLMAP, text or binary",
    used={
        "CAMERA_ID": "the pictures name it",
        "MODEL": "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV or FULL_OPENCV; others are refused",
        "WIDTH HEIGHT": "size of the pictures",
        "PARAMS": "focal lengths, principal point (pixel edges at integers) and distortion",
    },
)
COLMAP_IMAGE = Inventory(
    "a picture of COLMAP, text or binary",
    used={
        "QW QX QY QZ TX TY TZ": "world-to-camera, axes of OpenCV",
        "CAMERA_ID": "its camera",
        "NAME": "its file",
        "POINT3D_ID": "the points that it shows",
    },
    harmless={
        "IMAGE_ID": "a number of the database",
        "X Y": "a point is projected again",
        "rigs frames": "of new versions: the pose of a picture contains that of its rig",
    },
)
COLMAP_POINT = Inventory(
    "a point of COLMAP, text or binary",
    used={"POINT3D_ID": "the pictures name it", "X_ Y_ Z_": "position, the unit of the reconstruction"},
    harmless={
        "R_ G_ B_": "the scene takes its colours from the pictures",
        "ERROR": "a measure of the point, which moves no point",
        "TRACK": "the pictures name their points",
    },
)
