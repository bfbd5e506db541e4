"""What accuracy costs in time: errors against the certified exact renderer, beside seconds and visits.

`scenes` what is rendered; `settings` the dials; `measure` errors and costs of one setting; `certificate` why the
reference can be trusted; `study` all of it; `front` what is not dominated; `budget` advice; `training` the same for
fits; `figures` and `page` what a person sees.
"""
