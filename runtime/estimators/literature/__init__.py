"""Methods of the literature that comparisons offer beside those of the product.

Each is a record that the registry of methods finds by its name; no other room imports this folder.
"""
