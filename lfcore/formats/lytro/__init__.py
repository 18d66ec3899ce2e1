"""Lytro's files: the container that every one of them is, the metadata in it, and what else it may hold."""
