"""The store of experiments: records, stored answers of long measurements, intervals, published values."""
