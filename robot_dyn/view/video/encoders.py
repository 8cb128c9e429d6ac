"""Videos by the ffmpeg of imageio-ffmpeg: MP4 (H.264) and GIF.

Times of a GIF are multiples of 1/100 s: frame k begins at round(100 k / fps), so that errors do not accumulate.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from itertools import chain, islice
from pathlib import Path
from typing import Any

from robot_dyn.foundations.errors import VideoError
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import why

_CRF = 18  # constant rate factor of x264: nearly lossless to the eye
_PALETTE = "split[a][b];[a]palettegen[c];[b][c]paletteuse=dither=none"  # one for all frames


def ffmpeg() -> Any:
    """Return the module imageio_ffmpeg.

    Raises:
        MissingExtraError: If it is not installed.
        VideoError: If it has no ffmpeg.
    """
    module = needs("imageio_ffmpeg", extra="video")
    try:
        module.get_ffmpeg_exe()
    except RuntimeError:
        raise VideoError("imageio-ffmpeg has no ffmpeg for this system; install ffmpeg") from None
    return module


def encode(pictures: Iterable[bytes], file: Path, size: tuple[int, int], fps: int) -> None:
    """Write PNG pictures as .mp4, or as .gif, which repeats for ever; width and height are even numbers of pixels.

    Raises:
        VideoError: If ffmpeg fails.
    """
    from PIL import Image

    if file.suffix == ".gif":
        codec = {"codec": "gif", "pix_fmt_out": "pal8"}
        options = ["-filter_complex", _PALETTE, "-loop", "0", "-final_delay", str(round(100 / fps))]
    else:
        codec = {"codec": "libx264"}
        options = ["-crf", str(_CRF), "-movflags", "+faststart"]
    writer = ffmpeg().write_frames(
        str(file), size, fps=fps, quality=None, macro_block_size=1, ffmpeg_log_level="fatal", output_params=options,
        **codec,
    )  # fmt: skip
    try:
        pictures = iter(pictures)
        first = [*islice(pictures, 1)]  # before ffmpeg starts, which prints messages if it gets no picture
        writer.send(None)
        for picture in chain(first, pictures):
            writer.send(Image.open(io.BytesIO(picture)).convert("RGB").tobytes())
    except OSError as cause:
        raise VideoError(f"ffmpeg failed: {why(cause).splitlines()[0]}") from None
    finally:
        writer.close()
    if not file.is_file() or not file.stat().st_size:
        raise VideoError("ffmpeg wrote no output; check that the disk of the temporary folder is not full")
