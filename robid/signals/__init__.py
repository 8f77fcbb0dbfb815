"""Signals. Read `record`, `quantities`, `waveforms`, `friction`; `log_channels` and `log_options` say what a log is."""
