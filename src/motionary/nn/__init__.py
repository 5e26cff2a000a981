"""Building blocks of networks: layers, convolutions, transformer, recurrent units, quantizers, decoding."""
