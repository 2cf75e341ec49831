"""Height maps that others measured and published, fetched from their source by digest."""

from __future__ import annotations

import hashlib
import logging
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pipeline.errors import InputError

FOLDER_VARIABLE = "OPTIBENCH_DATA"
"""Environment variable: a folder in which published files are looked for before they are downloaded."""

THESIS = "https://raw.githubusercontent.com/simplay/Bachelor-Thesis/ef450c5420b768b2a1fd84c9ad768f34db12fc88"
CITATION = (
    "Single, Diffraction Shader, bachelor thesis, University of Bern (2014); github.com/simplay/Bachelor-Thesis, MIT"
)
_SECONDS = 30

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PublishedMap:
    """A map with what its file does not say.

    Attributes
    ----------
    file, source, sha256 : str
        Name of a copy, where the file is published, and the digest that it must have.
    what : str
        What was measured.
    pitch_um, full_height_um : float
        Distance of the samples, and height of grey 255 over 0.
    periodic : bool
        Whether the tile repeats.
    citation : str
        Whom to cite, and the licence.
    """

    file: str
    source: str
    sha256: str
    what: str
    pitch_um: float
    full_height_um: float
    periodic: bool = False
    citation: str = CITATION

    @property
    def caption(self) -> str:
        """For a figure."""
        return f"{self.what} ({self.citation})"


PUBLISHED: Final = {
    "elaphe": PublishedMap(
        file="Elaphe65microns.png",
        source=f"{THESIS}/document/Figures/results/misc/Elaphe65microns.png",
        sha256="fe49cf29a7527cf022a3860c0e25af9e6809b26a9ecb9662e1189f6ca79b6516",
        what="Shed skin of Elaphe guttata under an atomic-force microscope, full height uncertain",
        pitch_um=65 / 1332,
        full_height_um=0.375,
    ),
    "xenopeltis": PublishedMap(
        file="Xenopeltis65microns.png",
        source=f"{THESIS}/document/Figures/results/misc/XenoRotated_65MicronsMax818.69nm.png",
        sha256="fcddd5699ae2324e9c9407ba97b8bf72a18dd4563bef6eba27f15bab9cd434c6",
        what="Shed skin of Xenopeltis unicolor under an atomic-force microscope",
        pitch_um=65 / 1332,
        full_height_um=0.81869,
    ),
    "elaphe_crop": PublishedMap(
        file="Elaph100x100.png",
        source=f"{THESIS}/input_patches/Elaph100x100.png",
        sha256="75f4b3887276ad9634281eef79ab64b905527d9799c80d722743685cde0bd3ea",
        what="Patch of a shed skin of Elaphe guttata under an atomic-force microscope",
        pitch_um=0.065,
        full_height_um=0.375,
    ),
    "xenopeltis_crop": PublishedMap(
        file="Xeno100x100.png",
        source=f"{THESIS}/input_patches/Xeno100x100.png",
        sha256="da552770383a6bec5710f9e96269c46399a46f281c49177f3c70a0599e6a2524",
        what="Patch of a shed skin of Xenopeltis unicolor under an atomic-force microscope",
        pitch_um=0.065,
        full_height_um=0.44345,
    ),
    "blaze_tile": PublishedMap(
        file="BlazingBump.bmp",
        source=f"{THESIS}/input_patches/BlazingBump.bmp",
        sha256="b3f97491c3bb11e456bc69fd539d7da16808017d4c34e9c045a33b154ead7b12",
        what="Blazed grating that was drawn",
        pitch_um=0.025,
        full_height_um=0.246,
        periodic=True,
    ),
    "cosine_tile": PublishedMap(
        file="CosineBump.bmp",
        source=f"{THESIS}/input_patches/CosineBump.bmp",
        sha256="77c7d0c0b6d6c2e84ecfd1d48a16fb774b5320773433a664099d0ad73936d218",
        what="Cosine grating that was drawn",
        pitch_um=0.025,
        full_height_um=0.246,
        periodic=True,
    ),
}


def published_file(published: PublishedMap) -> Path:
    """A copy of the published file: one that is at hand, or a fresh one.

    Looked for in the folder that ``OPTIBENCH_DATA`` names, then in the user's cache, into which it is downloaded.

    Raises
    ------
    InputError
        It is not at hand and cannot be downloaded, or is no longer what was published.
    """
    import pooch
    import requests

    cache = Path(pooch.os_cache("optibench"))
    named = os.environ.get(FOLDER_VARIABLE)
    for folder in (Path(named).expanduser(), cache) if named else (cache,):
        copy = folder / published.file
        if not copy.is_file():
            continue
        if hashlib.sha256(copy.read_bytes()).hexdigest() == published.sha256:
            return copy
        log.warning("%s is not what was published, and is not used", copy)
    log.info("%s is downloaded from %s", published.file, published.source)
    pooch.get_logger().setLevel("WARNING")
    try:
        fetched = pooch.retrieve(
            published.source,
            f"sha256:{published.sha256}",
            published.file,
            cache,
            downloader=pooch.HTTPDownloader(timeout=_SECONDS),
        )
    except (OSError, ValueError) as error:  # requests' errors are OSErrors, a wrong digest is a ValueError
        unreachable = isinstance(error, requests.ConnectionError | requests.Timeout)
        reason = "its source cannot be reached" if unreachable else str(error).splitlines()[0]
        raise InputError(
            f"{published.file} is not on this machine and cannot be downloaded: {reason}",
            where=published.source,
            expected=f"a network, or a copy in the folder that the environment variable {FOLDER_VARIABLE} names",
            hint=f"its sha256 is {published.sha256}",
        ) from None
    return Path(fetched)
