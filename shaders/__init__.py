"""GLSL sources, loaded as package data by app.canvas."""
