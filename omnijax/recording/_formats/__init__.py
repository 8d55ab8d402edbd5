"""Files of every kind into columns of numbers."""

from .csv import CsvTable as CsvTable
from .csv import write_csv as write_csv
from .tables import may_be_run as may_be_run
from .tables import read_table as read_table
from .tables import stem_of as stem_of
from .tables import suffix_of as suffix_of
