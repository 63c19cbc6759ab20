"""A store in object storage: whole products are copied there from a local store, and read back from there.

An object store has no rename, so what says that a product is whole is written last and deleted first.
"""
