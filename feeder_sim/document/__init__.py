"""Documents: titles, tables, figures and remarks, as text, as HTML, in a notebook. Knows no run and no study."""
