"""Encoders of videos: MP4 (H.264) by the ffmpeg of imageio-ffmpeg, GIF by Pillow.

A GIF has times in steps of 1/100 s: frame k begins at round(100 k / fps), so that no error adds up.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_dyn.foundations.errors import VideoError
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import why

if TYPE_CHECKING:
    from PIL import Image

_CRF = 18  # constant rate factor of x264: differences are hardly seen
_SAMPLED = 8  # frames whose colours make the palette of a GIF


def ffmpeg() -> Any:
    """The module imageio_ffmpeg.

    Raises:
        MissingExtraError: If it is not installed.
        VideoError: If it has no ffmpeg.
    """
    module = needs("imageio_ffmpeg", extra="video")
    try:
        module.get_ffmpeg_exe()
    except RuntimeError:
        raise VideoError("imageio-ffmpeg has no ffmpeg for this system: install ffmpeg, or write a .gif") from None
    return module


def mp4(pictures: Iterable[bytes], file: Path, size: tuple[int, int], fps: int) -> None:
    """Write pictures (PNG) of a size in pixels, of even numbers.

    Raises:
        VideoError: If ffmpeg fails.
    """
    from PIL import Image

    writer = ffmpeg().write_frames(
        str(file), size, fps=fps, codec="libx264", quality=None, macro_block_size=1, ffmpeg_log_level="fatal",
        output_params=["-crf", str(_CRF), "-movflags", "+faststart"],
    )  # fmt: skip
    try:
        writer.send(None)
        for picture in pictures:
            writer.send(Image.open(io.BytesIO(picture)).convert("RGB").tobytes())
    except OSError as cause:
        raise VideoError(f"ffmpeg fails: {why(cause).splitlines()[0]}") from None
    finally:
        writer.close()
    if not file.is_file() or not file.stat().st_size:
        raise VideoError("ffmpeg has written nothing; is there room among the temporary files?")


def gif(pictures: Iterable[bytes], file: Path, fps: int) -> None:
    """Write pictures (PNG), with one palette for all, repeated without end."""
    from PIL import Image

    kept = list(pictures)
    palette = _palette(kept)
    reduced = (_image(picture).quantize(palette=palette, dither=Image.Dither.NONE) for picture in kept)
    duration = [10 * each for each in _hundredths(len(kept), fps)]  # [ms]
    next(reduced).save(file, "GIF", save_all=True, append_images=reduced, duration=duration, loop=0)


def _hundredths(count: int, fps: int) -> Iterator[int]:
    """How long each frame stays, in [1/100 s]."""
    for k in range(count):
        yield round(100 * (k + 1) / fps) - round(100 * k / fps)


def _palette(pictures: list[bytes]) -> Image.Image:
    """256 colours of some of the frames."""
    from PIL import Image

    chosen = [_image(pictures[k * (len(pictures) - 1) // max(_SAMPLED - 1, 1)]) for k in range(_SAMPLED)]
    width, height = chosen[0].size
    sheet = Image.new("RGB", (width, height * len(chosen)))
    for k, each in enumerate(chosen):
        sheet.paste(each, (0, k * height))
    return sheet.quantize(256, method=Image.Quantize.MAXCOVERAGE)  # small areas keep their colours


def _image(picture: bytes) -> Image.Image:
    from PIL import Image

    return Image.open(io.BytesIO(picture)).convert("RGB")
