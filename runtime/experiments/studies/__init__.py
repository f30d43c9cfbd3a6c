"""Studies, one module each; `runtime.experiments.studies_by_name` lists them."""
