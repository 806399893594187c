"""Run time against error, measured: the suite of scenes, its truths, methods, tables and plots; see README.md."""
