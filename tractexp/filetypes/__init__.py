"""What files hold, by type: COMTRADE, SEL event reports, tables; read into recordings and columns,
and written back.
"""
