"""robid identifies the elastic dynamics of industrial robots from their own motor signals."""

__version__ = "0.1.0"
