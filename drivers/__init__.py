"""How a plan gets to the hardware: waveforms, files and sinks."""
