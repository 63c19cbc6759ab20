"""What a mosaic holds."""

from dataclasses import replace

from tasks.publish.variables import Variable

INDEX = "image_index"
MAP = (
    Variable(
        "reflectance", "float32", "1", "reflectance under the standard geometry",
        ancillary="sigma sigma_noise sigma_pose sigma_photometry count",
    ),
    Variable(
        "sigma", "float32", "1", "1-sigma of the reflectance", "",
        comment="noise, pose and photometry together; an error that all images share is not in it",
    ),
    Variable("sigma_noise", "float32", "1", "1-sigma of the reflectance by the images' noise"),
    Variable("sigma_pose", "float32", "1", "1-sigma of the reflectance by where the ground is in the images"),
    Variable(
        "sigma_photometry", "float32", "1", "1-sigma of the reflectance by photometric law and levels of the images"
    ),
    Variable("count", "int16", "1", "number of images", "number_of_observations"),
    Variable("phase", "float32", "degree", "mean phase angle", "", (0.0, 180.0)),
    Variable("incidence", "float32", "degree", "mean incidence angle", "solar_zenith_angle", (0.0, 90.0)),
    Variable("emission", "float32", "degree", "mean emission angle", "sensor_zenith_angle", (0.0, 90.05)),
    Variable(
        "resolution_km", "float32", "km", "mean size of the images' pixels on the ground (longer side)", "",
        (0.0, 1e11), comment="what the reflectance is a mean over where it exceeds the map's own pixel",
    ),
    Variable(
        INDEX, "int16", "1", "number of the image with the largest weight", "",
        comment="from 0, in the order of the attribute products and of the dimension image; -1: none",
    ),
)  # fmt: skip


def map_variables(dims: tuple[str, ...], reflectance_unit: str, grid_mapping: str) -> list[Variable]:
    """The variables over `dims`. reflectance_unit: what a reflectance of 1 is."""
    found = []
    for variable in MAP:
        unit = reflectance_unit if variable.name.startswith(("reflectance", "sigma")) else variable.units
        found.append(replace(variable, dims=dims, units=unit, grid_mapping=grid_mapping))
    return found
