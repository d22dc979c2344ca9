"""The report's figures, as SVG text: curves, bars, scatter plots. Colours and fonts come from the page's style sheet."""
