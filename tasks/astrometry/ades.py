"""Observations as ADES, the Minor Planet Center's exchange format (version 2022), in XML."""

from collections.abc import Sequence
from xml.etree import ElementTree as xml

import numpy as np

from catalog.spice import Kernel
from tasks.astrometry.observation import BodyObservation

STATIONS = {-98: "C54"}  # codes of the MPC's list for spacecraft: New Horizons
NO_STATION = "XXX"
PLANETS = {4: "Mars", 5: "Jupiter", 6: "Saturn", 7: "Uranus", 8: "Neptune"}
EARTH = 399
FIRST_ASTEROID = 2_000_000
UNKNOWN_APERTURE_M = "0.1"  # the format has no word for unknown
PLACEHOLDERS = "Names, aperture and detector are placeholders that the submitter has to fill in"
GAIA, HIPPARCOS, OTHER = "Gaia3", "Hip2", "UNK"


def ades_of(observations: Sequence[BodyObservation], loaded: list[Kernel], station: str | None, version: str) -> bytes:
    """The observations as an ADES document, a block per camera. loaded: kernels that a `kernel_pool` around the call
    holds; where they know the spacecraft's place relative to the Earth, it is in it. station: MPC code; None takes the
    spacecraft's, or XXX."""
    root = xml.Element("ades", version="2022")
    for name in dict.fromkeys(each.exposure.camera.name for each in observations):
        members = [each for each in observations if each.exposure.camera.name == name]
        block = xml.SubElement(root, "obsBlock")
        _context(block, members[0], station, version)
        data = xml.SubElement(block, "obsData")
        for each in members:
            _optical(data, each, station, loaded)
    xml.indent(root)
    return bytes(xml.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def _context(block: xml.Element, first: BodyObservation, station: str | None, version: str) -> None:
    camera = first.exposure.camera
    context = xml.SubElement(block, "obsContext")
    observatory = xml.SubElement(context, "observatory")
    xml.SubElement(observatory, "mpcCode").text = _station(first, station)
    xml.SubElement(observatory, "name").text = camera.mission or camera.name
    submitter = xml.SubElement(context, "submitter")
    xml.SubElement(submitter, "name").text = "unknown"
    for role in ("observers", "measurers"):
        xml.SubElement(xml.SubElement(context, role), "name").text = "unknown"
    telescope = xml.SubElement(context, "telescope")
    xml.SubElement(telescope, "name").text = (camera.title or camera.name)[:100]
    xml.SubElement(telescope, "design").text = "Spacecraft camera"
    xml.SubElement(telescope, "aperture").text = UNKNOWN_APERTURE_M
    xml.SubElement(telescope, "detector").text = "UNK"
    software = xml.SubElement(context, "software")
    xml.SubElement(software, "astrometry").text = f"planetpose {version}"
    comment = xml.SubElement(context, "comment")
    xml.SubElement(comment, "line").text = PLACEHOLDERS


def _optical(data: xml.Element, each: BodyObservation, station: str | None, loaded: list[Kernel]) -> None:
    row, exposure = each.row, each.exposure
    optical = xml.SubElement(data, "optical")

    def say(name: str, text: str | None) -> None:
        if text is not None:
            xml.SubElement(optical, name).text = text

    number = perm_id(exposure.target.naif_id)
    say("permID", number)
    say("trkSub", None if number else "".join(c for c in exposure.target.name if c.isalnum())[:8])
    say("mode", "CCD")
    say("stn", _station(each, station))
    for name, text in _location(each, loaded):
        say(name, text)
    say("obsTime", str(row["utc"]))
    astrometric = row["ra_astrometric_deg"] is not None
    ra, dec = (row[f"{name}_astrometric_deg" if astrometric else f"{name}_deg"] for name in ("ra", "dec"))
    say("ra", f"{float(ra or 0.0):.8f}")
    say("dec", f"{float(dec or 0.0):+.8f}")
    for name, key in (("rmsRA", "sigma_ra_arcsec"), ("rmsDec", "sigma_dec_arcsec"), ("rmsCorr", "sigma_correlation")):
        say(name, None if row[key] is None else _short(float(row[key] or 0.0), 6))
    catalog = str(row["catalog"])
    say("astCat", GAIA if "gaia" in catalog.lower() else HIPPARCOS if "hipparcos" in catalog.lower() else OTHER)
    say("exp", _short(exposure.exposure_s, 6))
    say("rmsFit", _short(float(each.stars["rms_px"]) / exposure.camera.focal_length_px * 206264.806, 6))
    say("nStars", str(row["stars"]))
    if not astrometric:
        say("remarks", "apparent place: the spacecraft's velocity was not known")


def perm_id(naif_id: int) -> str | None:
    """The MPC's permanent designation of a natural satellite (Jupiter 2) or a numbered asteroid; None for others."""
    planet, number = divmod(naif_id, 100)
    if planet in PLANETS and 0 < number < 99:
        return f"{PLANETS[planet]} {number}"
    return str(naif_id - FIRST_ASTEROID) if FIRST_ASTEROID < naif_id < FIRST_ASTEROID + 1_000_000 else None


def _station(each: BodyObservation, station: str | None) -> str:
    return station or STATIONS.get(each.exposure.camera.naif_spacecraft_id or 0, NO_STATION)


def _location(each: BodyObservation, loaded: list[Kernel]) -> list[tuple[str, str]]:
    """The spacecraft from the Earth's centre, ICRF km, where the kernels know it."""
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    craft = each.exposure.camera.naif_spacecraft_id
    if craft is None or not loaded:
        return []
    try:
        position = np.asarray(spiceypy.spkgeo(craft, each.exposure.pose.et, "J2000", EARTH)[0])[:3]
    except SpiceyError:
        return []
    places = [(f"pos{axis}", f"{value:+.2f}"[:14]) for axis, value in enumerate(position, 1)]
    return [("sys", "ICRF_KM"), ("ctr", str(EARTH)), *places]


def _short(value: float, width: int) -> str:
    """A number in at most `width` characters, and not as 0 where it is not."""
    text = f"{value:.{width}f}"[:width]
    return text if float(text) or not value else f"{10.0 ** -(width - 2):.{width - 2}f}"[:width]
