"""Damaged files for every door: is each read or refused in a sentence, and nothing else?"""
