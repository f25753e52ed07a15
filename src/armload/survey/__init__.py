"""Surveys: thousands of logs of many arms, one table, and what it says of payloads and arms."""

from armload.survey.logs import Log, find_logs
from armload.survey.run import Survey, survey
from armload.survey.settings import Settings
from armload.survey.table_file import read_rows, write_rows

__all__ = ["Log", "Settings", "Survey", "find_logs", "read_rows", "survey", "write_rows"]
