"""The tests; a package so that rooms of the same name in both workshops can be tested."""
