// A sphere of radius R, seen square on from far: the point seen a beside the apex lies at the polar angle
// theta = asin(a / R), its distance from the apex is 2 R sin(theta / 2) straight and R theta along the surface, a pixel
// covers its area / cos(theta), and the line of sight makes theta with the normal.
//
// Which distance a profile S(r) measured on a plane should be taken at is open: light goes straight through the sample
// where it is much larger than the mean free path, but a convex body has less of it than a half-space. Both are
// offered; they part as a^2 / (8 R^2): 0.5 % at a fifth of the radius. Stops being true for other shapes (a cylinder
// bends in one direction only) and for a camera that is near or aslant.
#include "fit/curvature.h"
#include "fit/exit_angle.h"
#include <math.h>

const char *const alb_distance_names[ALB_DISTANCES] = {"chord", "arc"};

double alb_curved_distance(double aside_mm, double radius_mm, alb_distance distance)
{
    const double angle = asin(aside_mm / radius_mm);
    return distance == ALB_DISTANCE_ARC ? radius_mm * angle : 2 * radius_mm * sin(angle / 2);
}

void alb_face_curve(alb_face *face, double x_mm, double y_mm, double radius_mm, alb_distance distance)
{
    const size_t count = (size_t)face->width * (size_t)face->height;
    const double most = radius_mm * sin(ALB_EXIT_MOST_DEG * M_PI / 180);
    for (size_t i = 0; i < count; i++) {
        const double x = face->x_mm[i] - x_mm, y = face->y_mm[i] - y_mm, aside = hypot(x, y);
        if (!(aside <= most)) {
            face->x_mm[i] = face->y_mm[i] = face->area_mm2[i] = face->cosine[i] = NAN;
            continue;
        }
        const double stretch = aside > 0 ? alb_curved_distance(aside, radius_mm, distance) / aside : 1,
                     cosine = sqrt(1 - aside * aside / (radius_mm * radius_mm));
        face->x_mm[i] = x_mm + stretch * x;
        face->y_mm[i] = y_mm + stretch * y;
        face->area_mm2[i] /= cosine;
        face->cosine[i] = cosine;
    }
}
