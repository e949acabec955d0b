"""Cases whose missing effect is concealed: made, diagnosed, and only then revealed."""
