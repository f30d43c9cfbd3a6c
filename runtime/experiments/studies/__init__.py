"""The studies, one module each; `runtime.experiments.registry` lists them."""
