"""Many machines without a shared folder, on one: an S3 server, and Dask processes with folders of their own."""
