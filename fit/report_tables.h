// The tables of a fit's page.
#pragma once
#include "base/page.h"
#include "fit/measurement.h"

// "± 0.12" with the sign given; "(undecided)" where there is no sd.
enum { ALB_SD_TEXT_SIZE = 32 };
const char *alb_sd_text(char text[ALB_SD_TEXT_SIZE], const char *sign, double sd);

void alb_report_profiles(alb_page *page, const alb_fitting *fitting);
void alb_report_parameters(alb_page *page, const alb_fitting *fitting);
void alb_report_correlations(alb_page *page, const alb_fitting *fitting);
void alb_report_attempts(alb_page *page, const alb_fitting *fitting);
void alb_report_energy(alb_page *page, const alb_fitting *fitting);
void alb_report_properties(alb_page *page, const alb_fitting *fitting); // nothing where none were tried
void alb_report_readings(alb_page *page, const alb_fitting *fitting);
