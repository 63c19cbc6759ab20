"""Export: products in the forms that other tools read (issue E): FITS, GeoTIFF, map-projected Zarr, STAC, tables."""
