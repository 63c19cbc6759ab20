"""Stars of a frame: found, identified in a catalog, and the camera's orientation from them."""
