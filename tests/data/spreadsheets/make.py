"""Writes the spreadsheets: a first-order plant, K = 2 and tau = 90 s, every 10 s, below a title and units, in the second sheet of three.

    pip install openpyxl==3.1.5 odfpy==1.4.1 xlwt==1.3.0
    python make.py
"""

import datetime
import math

import openpyxl
import xlwt
from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P

START = datetime.datetime(2024, 1, 10, 23, 50)
rows, state, level = [], 0.0, 0
for k in range(120):
    rows.append((START + datetime.timedelta(seconds=10 * k), level, round(20 + state, 5)))
    decay = math.exp(-10 / 90)
    state = decay * state + 2 * (1 - decay) * level
    if k % 7 == 4 or k % 11 == 3:
        level = 1 - level
HEAD = [["Export of pump 3"], [], ["Date", "u", "y"], ["", "V", "degC"]]
NOTES = [["Recorded by the night shift"]]
OTHER = [["a", "b"], [1, 2], [3, 4]]

book = openpyxl.Workbook()
for name, table in (("Notes", NOTES), ("Data", HEAD + rows), ("Other", OTHER)):
    sheet = book.create_sheet(name)
    for row in table:
        sheet.append(list(row))
del book["Sheet"]
book.save("log.xlsx")

old = xlwt.Workbook()
style = xlwt.easyxf(num_format_str="YYYY-MM-DD HH:MM:SS")
for name, table in (("Notes", NOTES), ("Data", HEAD + rows), ("Other", OTHER)):
    sheet = old.add_sheet(name)
    for place, row in enumerate(table):
        for column, value in enumerate(row):
            if isinstance(value, datetime.datetime):
                sheet.write(place, column, value, style)
            else:
                sheet.write(place, column, value)
old.save("log.xls")

free = OpenDocumentSpreadsheet()
for name, table in (("Notes", NOTES), ("Data", HEAD + rows), ("Other", OTHER)):
    sheet = Table(name=name)
    for row in table:
        line = TableRow()
        for value in row:
            if isinstance(value, datetime.datetime):
                cell = TableCell(valuetype="date", datevalue=value.isoformat())
            elif isinstance(value, str):
                cell = TableCell(valuetype="string")
            else:
                cell = TableCell(valuetype="float", value=str(value))
            cell.addElement(P(text=str(value)))
            line.addElement(cell)
        sheet.addElement(line)
    free.spreadsheet.addElement(sheet)
free.save("log.ods")
