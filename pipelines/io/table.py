from pipelines.io.files import write_csv
from pipelines.io.parquet import csv_cell, write_rows, write_table

__all__ = ["csv_cell", "write_csv", "write_rows", "write_table"]
