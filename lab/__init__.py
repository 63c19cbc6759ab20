"""Instruments: what simulates images, measures the corrections, and tries out the program itself.

A room per instrument. They use flows, tasks and catalog; none of those knows them. The command line finds their
commands by the entry points `planetpose.commands` of pyproject.toml.
"""
