// Faces that turn away or lie between the centres, most of a fine mesh, are sorted out first; of the others the corners
// are put in order of rows by choices, not branches, and each edge is followed from its upper end, by whichever face:
// the same bits for both that share it. With y down, a front face (counter-clockwise to the eye) has a negative area.
#include "render/shadow_rows.h"
#include "base/vector_clones.h"

static inline float least(float a, float b) { return a < b ? a : b; }
static inline float most(float a, float b) { return a > b ? a : b; }

ALB_VECTOR_CLONES
static void find_drawn(int32_t *restrict drawn, alb_shadow_rows *restrict r, const alb_shadow_corners *corners,
                       const uint32_t (*faces)[3], int count, bool fronts_only)
{
    const float *restrict x = corners->x, *restrict y = corners->y;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            r->x[k][i] = x[faces[i][k]];
            r->y[k][i] = y[faces[i][k]];
        }
    for (int i = 0; i < count; i++) {
        const float ax = r->x[0][i], bx = r->x[1][i], cx = r->x[2][i];
        const float ay = r->y[0][i], by = r->y[1][i], cy = r->y[2][i];
        const int32_t front = (bx - ax) * (cy - ay) < (cx - ax) * (by - ay);
        const int32_t wide =
            alb_shadow_first_beyond(least(ax, least(bx, cx))) < alb_shadow_first_beyond(most(ax, most(bx, cx)));
        const int32_t high =
            alb_shadow_first_beyond(least(ay, least(by, cy))) < alb_shadow_first_beyond(most(ay, most(by, cy)));
        drawn[i] = (front | !fronts_only) & wide & high;
    }
}

// Where no row is followed along an edge its figure need not be finite.
ALB_VECTOR_CLONES
static void find_edges(alb_shadow_rows *restrict r)
{
    for (int n = 0; n < r->count; n++) {
        const int32_t i = r->faces[n];
        const float ax = r->x[0][i], bx = r->x[1][i], cx = r->x[2][i], ay = r->y[0][i], by = r->y[1][i],
                    cy = r->y[2][i];
        const bool first = ay > by;
        const float dx = first ? bx : ax, dy = first ? by : ay, ex = first ? ax : bx, ey = first ? ay : by;
        const bool second = ey > cy;
        const float fx = second ? cx : ex, fy = second ? cy : ey, lower_x = second ? ex : cx,
                    lower_y = second ? ey : cy;
        const bool third = dy > fy;
        const float upper_x = third ? fx : dx, upper_y = third ? fy : dy, middle_x = third ? dx : fx,
                    middle_y = third ? dy : fy;
        r->upper_x[n] = upper_x, r->upper_y[n] = upper_y, r->middle_x[n] = middle_x, r->middle_y[n] = middle_y;
        r->along[n] = (lower_x - upper_x) / (lower_y - upper_y);
        r->above[n] = (middle_x - upper_x) / (middle_y - upper_y);
        r->below[n] = (lower_x - middle_x) / (lower_y - middle_y);
        r->top[n] = alb_shadow_first_beyond(upper_y);
        r->middle[n] = alb_shadow_first_beyond(middle_y);
        r->bottom[n] = alb_shadow_first_beyond(lower_y);
    }
}

void alb_shadow_rows_set(alb_shadow_rows *rows, const alb_shadow_corners *corners, const uint32_t (*faces)[3],
                         int count, bool fronts_only)
{
    int32_t drawn[ALB_SHADOW_FACES];
    find_drawn(drawn, rows, corners, faces, count, fronts_only);
    rows->count = 0;
    for (int i = 0; i < count; i++) { // a place is taken by the next face unless this one stays
        rows->faces[rows->count] = i;
        rows->count += drawn[i];
    }
    find_edges(rows);
}
