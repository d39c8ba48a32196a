// The tables of a fit's page.
#pragma once
#include "base/page.h"
#include "fit/measurement.h"

void alb_report_profiles(alb_page *page, const alb_fitting *fitting);
void alb_report_parameters(alb_page *page, const alb_fitting *fitting);
void alb_report_correlations(alb_page *page, const alb_fitting *fitting);
void alb_report_attempts(alb_page *page, const alb_fitting *fitting);
void alb_report_energy(alb_page *page, const alb_fitting *fitting);
void alb_report_properties(alb_page *page, const alb_fitting *fitting); // nothing where none were tried
void alb_report_readings(alb_page *page, const alb_fitting *fitting);
