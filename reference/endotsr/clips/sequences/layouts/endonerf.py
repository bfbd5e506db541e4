"""EndoNeRF folders: `images/`, `depth/`, `masks/` and `poses_bounds.npy`."""

from endotsr.clips.sequences.endonerf import input_hashes, open_endonerf, read_endonerf, recognises
from endotsr.clips.sequences.layouts import Layout

LAYOUT = Layout(
    name="endonerf",
    about="a folder with images/, depth/, masks/ and poses_bounds.npy",
    rank=1,
    recognises=recognises,
    open=open_endonerf,
    read=read_endonerf,
    hashes=input_hashes,
    takes=("baseline", "masks", "depth"),
)
