"""Arms of the da Vinci research kit: fits, friction of single runs, and the load of a run."""
