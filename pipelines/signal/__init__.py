"""Numbers in, numbers out: filters, spectra, derivatives. No robot words."""
