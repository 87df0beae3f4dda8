"""The paper's figures, made again: Naik and Nair, Coupled Piezoelectric Actuators for the Tactile Display."""
