"""The TOML files of this folder are the cameras."""
