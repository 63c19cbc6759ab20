"""Simulated star fields: is the orientation right, as sure as it says, and is nothing found where nothing is?"""
