"""Names of the files in a product folder."""

CUBE, OVERLAY, RESULT, SETTINGS = "cube.zarr", "overlay.png", "result.json", "settings.json"
