"""Signals: the record, excitation spectra, friction laws."""
