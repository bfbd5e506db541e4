"""Two views in one stored picture: side by side, or one above the other, perhaps squeezed to half their size.

In: a picture, or its size, and the arrangement that a user states. Out: the two views, or the size of one.
"""

from endotsr.clips.opencv.filters import stretched
from endotsr.clips.sequences.clip import Picture, PicturePair
from endotsr.errors import InputError

# Pairs whose views are squeezed: how they are arranged, and the factors that restore width and height.
SQUEEZED = {"half_side_by_side": ("side_by_side", 2, 1), "half_stacked": ("stacked", 1, 2)}
WIDEST = 2.2  # width over height, above which a view of a stacked pair is probably squeezed


def split_pair(picture: Picture, stereo: str, where: object) -> PicturePair:
    """Left and right of one stored picture: side by side (left half first), stacked (left on top), or none.

    Squeezed views are restored to their width or height.

    Raises:  InputError for a picture without two equal halves.
    """
    height, width = picture.shape[:2]
    if stereo == "none":
        return PicturePair(picture)
    if stereo in SQUEEZED:
        arrangement, *factors = SQUEEZED[stereo]
        pair = split_pair(picture, arrangement, where)
        return PicturePair(*(stretched(view, *factors) for view in pair if view is not None))
    if (width if stereo == "side_by_side" else height) % 2:
        side = "width" if stereo == "side_by_side" else "height"
        raise InputError(f"{where}: {width}x{height} pixels: a {stereo} pair has an even {side}")
    if stereo == "side_by_side":
        return PicturePair(picture[:, : width // 2], picture[:, width // 2 :])
    return PicturePair(picture[: height // 2], picture[height // 2 :])


def view_size(width: int, height: int, stereo: str) -> tuple[int, int]:
    """The size of one picture of a stored pair."""
    if stereo in SQUEEZED:
        arrangement, across, down = SQUEEZED[stereo]
        width, height = view_size(width, height, arrangement)
        return across * width, down * height
    return (width // 2 if stereo == "side_by_side" else width), (height // 2 if stereo == "stacked" else height)


def squeezed_note(width: int, height: int, stereo: str) -> list[str]:
    """A note on the views of a pair whose shape indicates that they are squeezed to half their width or height."""
    if stereo == "side_by_side" and width < height:
        shape, side = "higher than wide", "width"
    elif stereo == "stacked" and width > WIDEST * height:
        shape, side = f"{width / height:.3g} times as wide as high", "height"
    else:
        return []
    restored = f"if the views are squeezed to half their {side}, --stereo half_{stereo} restores it"
    return [f"each view of {width}x{height} pixels is {shape}: {restored}"]
