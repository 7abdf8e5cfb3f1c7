"""Study of live updating: errors of a twin that is kept up to date, against a frozen one."""
