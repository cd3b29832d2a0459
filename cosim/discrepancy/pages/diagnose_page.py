def format_diagnosis(*a): return ""
