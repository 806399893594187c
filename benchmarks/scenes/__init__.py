"""The scenes of the suite, one module each; `benchmarks.suite` lists and builds them."""
