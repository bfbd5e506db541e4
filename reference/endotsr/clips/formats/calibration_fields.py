"""The fields of every calibration format; see `inventory`. `calibration_formats` reads them."""

from endotsr.clips.formats.inventory import Inventory

OTHER_MODEL = "another camera model is not supported: calibrate as a pinhole camera with the model of OpenCV"
RECTIFIED = "it follows from both cameras, and is computed again"
OF_CALIBRATION = "it documents the calibration"

# Key names are free in OpenCV's files: these are the names of OpenCV's samples and tutorials, SCARED and common tools.
MATRICES = ("camera_matrix", "Camera_Matrix", "K", "cameraMatrix", "mtx", "camera_mtx", "intrinsic_matrix")
DISTORTIONS = ("distortion_coefficients", "Distortion_Coefficients", "D", "distCoeffs", "dist", "dist_coeffs",
               "dist_coeff", "distortion")  # fmt: skip
PAIRS = (("M1", "M2"), ("K1", "K2"), ("cameraMatrix1", "cameraMatrix2"), ("mtx1", "mtx2"), ("mtxL", "mtxR"))
PAIR_DISTORTIONS = (("D1", "D2"), ("distCoeffs1", "distCoeffs2"), ("dist1", "dist2"), ("distL", "distR"))

MODELS = "fisheye_model fisheye distortion_model camera_model model model_type xi skew"
PINHOLE = {  # values of fields that name the model, with which nothing is refused
    "distortion_model": ("plumb_bob", "rational_polynomial", "radtan"),
    "camera_model": ("pinhole", "PINHOLE", "perspective"),
    "model": ("pinhole", "perspective"),
    "model_type": ("PINHOLE",),
}

KALIBR = Inventory(
    "a camera of camchain.yaml of Kalibr",
    used={
        "camera_model distortion_model": "pinhole, with radtan or none",
        "intrinsics": "fx fy cx cy, pixel centres at integers",
        "distortion_coeffs": "k1 k2 p1 p2",
        "resolution": "width and height",
        "T_cn_cnm1": "pose of the second camera relative to the first, metres",
    },
    refused={"line_delay line_delay_nanoseconds": "a rolling shutter is not supported"},
    harmless={
        "cam_overlaps rostopic": OF_CALIBRATION,
        "T_cam_imu T_imu_cam timeshift_cam_imu": "it relates the camera to an inertial sensor, which is not read",
    },
)
ROS = Inventory(
    "camera_info of ROS 1 and 2, as a file or printed by rostopic echo",
    used={
        "image_width width image_height height": "size of the pictures",
        "distortion_model": "plumb_bob or rational_polynomial",
        "camera_matrix K k": "intrinsics, pixel centres at integers",
        "distortion_coefficients D d": "distortion in the order of OpenCV",
        "rectification_matrix R r": "rotation of a camera to the rectified pair; of one camera not needed",
        "projection_matrix P p": "of the right camera of a pair: -fx times the baseline in metres",
    },
    refused={
        "binning_x binning_y": "the pictures of a binned camera are smaller: state width, height and K of the pictures",
        "roi": "a part of the sensor: state K of the pictures, and roi 0",
    },
    harmless={"header camera_name": OF_CALIBRATION},
    neutral={"binning_x": (1,), "binning_y": (1,)},
)
OPENCV = Inventory(
    "storage of OpenCV in YAML, XML or JSON, and the same names in an .npz file",
    used={
        " ".join(MATRICES): "intrinsics of one camera",
        " ".join(DISTORTIONS): "its distortion",
        " ".join(map(" ".join, PAIRS)): "intrinsics of a pair",
        " ".join(map(" ".join, PAIR_DISTORTIONS)): "its distortions",
        "R T": "pose of the right camera relative to the left, millimetres",
        "image_width image_height image_Width image_Height width height": "size of the pictures",
    },
    refused={
        MODELS: OTHER_MODEL,
    },
    harmless={
        "E F R1 R2 P1 P2 Q H1 H2 rectified* roi roi1 roi2 validRoi* map*": RECTIFIED,
        "calibration_time calibration_Time nframes nrOfFrames board_* square_* Square_* flags flagValue *_error"
        " *_errors avg_* Avg_* per_view_* extrinsic_parameters Extrinsic_Parameters image_points Image_points"
        " grid_points aspectRatio FixAspectRatio rms ret": OF_CALIBRATION,
        "rvecs tvecs": "the poses of the board do not concern the pictures of the clip",
    },
    neutral=PINHOLE,
    told={
        "newcameramtx newCameraMatrix new_camera_matrix": "the camera of pictures that were undistorted with it; if"
        " these are such pictures, state it with --camera",
    },
)
FLAT = Inventory(
    "plain numbers fx, fy, cx, cy in JSON, YAML or an .npz file",
    used={
        "fx fy cx cy": "intrinsics, pixel centres at integers",
        "width height w h image_width image_height": "size of the pictures",
        "k1 k2 p1 p2 k3 k4 k5 k6": "distortion in the model of OpenCV",
        " ".join(DISTORTIONS): "the same as a list",
    },
    refused={
        MODELS: OTHER_MODEL,
        "coeffs": "write the coefficients as k1, k2, p1, p2 and k3",
    },
    neutral=PINHOLE,
)
INI = Inventory(
    "a section of the ini file of StereoMIS",
    used={
        "res_x res_y": "size of the pictures",
        "fc_x fc_y cc_x cc_y": "intrinsics, pixel centres at integers",
        "kc_?": "distortion in the order of OpenCV",
        "R_? T_?": "pose of the right camera relative to the left, millimetres",
    },
    refused={"skew alpha_c": "square pixels alone are supported"},
)
