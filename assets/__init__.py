"""Weights and the sample light field, loaded as package data."""
