"""Reading a whole film back."""

from pathlib import Path

from endotsr.clips.formats.video_file import video_facts, video_pictures


def read_video(path: Path) -> list:
    """Every picture, (H, W, 3) uint8 RGB."""
    return list(video_pictures(path, list(range(video_facts(path).count))))
