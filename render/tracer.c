// Embree's robust mode: no ray slips between triangles that share an edge. Single precision about the middle of the
// mesh, so that a scene far from the origin is as sharp as one at it: points nearer than about 1e-7 of the extent
// cannot be told apart, which is why rays start offset (render/patch.h) and fronts win over backs that near to them.
// Whether they do is asked only after a back was met, which happens in no sound closed scene. Stops being true for
// meshes whose extent over detail exceeds 1e6.
#include "render/tracer.h"
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

// The two versions differ in how a filter is handed over.
#if RTC_VERSION_MAJOR >= 4
#define FILTERED RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS
typedef struct RTCRayQueryContext query;
static void intersect(RTCScene scene, query *context, RTCFilterFunctionN filter, struct RTCRayHit *ray)
{
    struct RTCIntersectArguments arguments;
    rtcInitRayQueryContext(context);
    rtcInitIntersectArguments(&arguments);
    arguments.context = context;
    arguments.filter = filter;
    if (filter)
        arguments.flags |= RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
    rtcIntersect1(scene, ray, &arguments);
}
static void occluded(RTCScene scene, query *context, struct RTCRay *ray)
{
    (void)context;
    rtcOccluded1(scene, ray, NULL);
}
#else
#define FILTERED RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION
typedef struct RTCIntersectContext query;
static void intersect(RTCScene scene, query *context, RTCFilterFunctionN filter, struct RTCRayHit *ray)
{
    rtcInitIntersectContext(context);
    context->filter = filter;
    rtcIntersect1(scene, context, ray);
}
static void occluded(RTCScene scene, query *context, struct RTCRay *ray)
{
    rtcInitIntersectContext(context);
    rtcOccluded1(scene, context, ray);
}
#endif

static bool count_bytes(void *user, ssize_t bytes, bool post)
{
    (void)post;
    __atomic_add_fetch((int64_t *)user, bytes, __ATOMIC_RELAXED);
    return true;
}

// Middle and half extent of the vertices; those that are not finite are left out.
static void find_bounds(alb_tracer *tracer, const alb_vector *vertices, size_t count)
{
    alb_vector low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        const alb_vector v = vertices[i];
        if (!isfinite(v.x + v.y + v.z))
            continue;
        low = (alb_vector){fmin(low.x, v.x), fmin(low.y, v.y), fmin(low.z, v.z)};
        high = (alb_vector){fmax(high.x, v.x), fmax(high.y, v.y), fmax(high.z, v.z)};
    }
    if (low.x > high.x)
        return;
    const alb_vector half = alb_times(0.5, alb_sub(high, low));
    tracer->middle = alb_add(low, half);
    tracer->slack_mm = 64 * 0x1p-24 * fmax(half.x, fmax(half.y, half.z));
}

static void place(float *out, const alb_vector *vertices, size_t count, alb_vector middle)
{
    for (size_t i = 0; i < count; i++) {
        const alb_vector v = alb_sub(vertices[i], middle);
        out[3 * i] = (float)v.x;
        out[3 * i + 1] = (float)v.y;
        out[3 * i + 2] = (float)v.z;
    }
}

static bool fill(RTCGeometry geometry, const alb_mesh *mesh, alb_vector centre)
{
    float *vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                              mesh->vertex_count);
    uint32_t *faces = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              3 * sizeof(uint32_t), mesh->face_count);
    if (!vertices || !faces)
        return false;
    place(vertices, mesh->vertices, mesh->vertex_count, centre);
    for (size_t i = 0; i < mesh->face_count; i++)
        for (size_t k = 0; k < 3; k++)
            faces[3 * i + k] = mesh->faces[i][k];
    return true;
}

static bool create(alb_tracer *tracer, const alb_mesh *mesh, bool moves, alb_error *error)
{
    *tracer = (alb_tracer){0};
    RTCDevice device = rtcNewDevice(moves ? "threads=1" : NULL); // waking threads takes longer than a small mesh
    if (!device) {
        const enum RTCError code = rtcGetDeviceError(NULL);
        return alb_fail(error, code == RTC_ERROR_OUT_OF_MEMORY ? ALB_NO_MEMORY : ALB_INTERNAL,
                        "Embree: cannot start (error %d)", (int)code);
    }
    tracer->device = device;
    rtcSetDeviceMemoryMonitorFunction(device, count_bytes, &tracer->bytes);
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    tracer->scene = scene;
    find_bounds(tracer, mesh->vertices, mesh->vertex_count);
    bool ok = scene && geometry && (!mesh->face_count || fill(geometry, mesh, tracer->middle));
    if (ok) {
        rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST | FILTERED | (moves ? RTC_SCENE_FLAG_DYNAMIC : 0));
        rtcSetSceneBuildQuality(scene, moves ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_HIGH);
        if (moves)
            rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_LOW);
        if (mesh->face_count) {
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(scene, geometry); // which keeps it alive
            tracer->geometry = geometry;
        }
        rtcCommitScene(scene);
    }
    if (geometry)
        rtcReleaseGeometry(geometry);
    const enum RTCError code = rtcGetDeviceError(device);
    if (ok && code == RTC_ERROR_NONE)
        return true;
    alb_tracer_free(tracer);
    return alb_fail(error, code == RTC_ERROR_OUT_OF_MEMORY ? ALB_NO_MEMORY : ALB_INTERNAL,
                    "Embree: cannot build the scene of %zu triangles (error %d)", mesh->face_count, (int)code);
}

bool alb_tracer_create(alb_tracer *tracer, const alb_mesh *mesh, alb_error *error)
{
    return create(tracer, mesh, false, error);
}

bool alb_tracer_create_moving(alb_tracer *tracer, const alb_mesh *mesh, alb_error *error)
{
    return create(tracer, mesh, true, error);
}

bool alb_tracer_move(alb_tracer *tracer, const alb_vector *vertices, size_t count, alb_error *error)
{
    RTCGeometry geometry = tracer->geometry;
    if (geometry) {
        find_bounds(tracer, vertices, count);
        place(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_VERTEX, 0), vertices, count, tracer->middle);
        rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry);
        rtcCommitScene(tracer->scene);
    }
    const enum RTCError code = rtcGetDeviceError(tracer->device);
    return code == RTC_ERROR_NONE || alb_fail(error, code == RTC_ERROR_OUT_OF_MEMORY ? ALB_NO_MEMORY : ALB_INTERNAL,
                                              "Embree: cannot move %zu vertices (error %d)", count, (int)code);
}

void alb_tracer_free(alb_tracer *tracer)
{
    if (tracer->scene)
        rtcReleaseScene(tracer->scene);
    if (tracer->device)
        rtcReleaseDevice(tracer->device);
    *tracer = (alb_tracer){0};
}

static struct RTCRay ray_of(const alb_tracer *tracer, alb_vector origin, alb_vector direction, float near, float far)
{
    const alb_vector from = alb_sub(origin, tracer->middle);
    return (struct RTCRay){.org_x = (float)from.x,
                           .org_y = (float)from.y,
                           .org_z = (float)from.z,
                           .dir_x = (float)direction.x,
                           .dir_y = (float)direction.y,
                           .dir_z = (float)direction.z,
                           .tnear = near,
                           .tfar = far,
                           .mask = UINT32_MAX};
}

// A look at every triangle along a ray: Embree offers each to the filter, which turns all down and keeps what it wants.
typedef struct sweep {
    query query; // first: the filter is handed its address
    alb_vector direction;
    int crossings;
    bool found; // the nearest front
    alb_hit front;
} sweep;

static void look(const struct RTCFilterFunctionNArguments *at) // of single rays: N is 1
{
    sweep *s = (sweep *)(void *)at->context;
    const struct RTCRay *ray = (const struct RTCRay *)(const void *)at->ray;
    const struct RTCHit *hit = (const struct RTCHit *)(const void *)at->hit;
    const alb_vector normal = {(double)hit->Ng_x, (double)hit->Ng_y, (double)hit->Ng_z};
    const bool front = alb_dot(normal, s->direction) < 0;
    at->valid[0] = 0;
    s->crossings += front ? 1 : -1;
    if (!front || (s->found && s->front.distance_mm <= (double)ray->tfar))
        return;
    s->found = true;
    s->front = (alb_hit){
        .face = hit->primID, .front = true, .u = (double)hit->u, .v = (double)hit->v, .distance_mm = (double)ray->tfar};
}

static void sweep_along(sweep *s, const alb_tracer *tracer, alb_vector origin, alb_vector direction, double near,
                        double far)
{
    struct RTCRayHit ray = {.ray = ray_of(tracer, origin, direction, (float)near, (float)far),
                            .hit.geomID = RTC_INVALID_GEOMETRY_ID};
    *s = (sweep){.direction = direction};
    intersect(tracer->scene, &s->query, look, &ray);
}

bool alb_tracer_closest(alb_hit *hit, const alb_tracer *tracer, alb_vector origin, alb_vector direction)
{
    struct RTCRayHit ray = {.ray = ray_of(tracer, origin, direction, 0, INFINITY),
                            .hit.geomID = RTC_INVALID_GEOMETRY_ID};
    query plain;
    intersect(tracer->scene, &plain, NULL, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    const alb_vector normal = {(double)ray.hit.Ng_x, (double)ray.hit.Ng_y, (double)ray.hit.Ng_z};
    *hit = (alb_hit){.face = ray.hit.primID,
                     .front = alb_dot(normal, direction) < 0,
                     .u = (double)ray.hit.u,
                     .v = (double)ray.hit.v,
                     .distance_mm = (double)ray.ray.tfar};
    if (!hit->front) {
        sweep s;
        sweep_along(&s, tracer, origin, direction, fmax(0, hit->distance_mm - tracer->slack_mm),
                    hit->distance_mm + tracer->slack_mm);
        *hit = s.found ? s.front : *hit;
    }
    return true;
}

int alb_tracer_crossings(const alb_tracer *tracer, alb_vector origin, alb_vector direction)
{
    sweep s;
    sweep_along(&s, tracer, origin, direction, 0, INFINITY);
    return s.crossings;
}

bool alb_tracer_blocked(const alb_tracer *tracer, alb_vector from, alb_vector to)
{
    // the far end stops short of a surface on which `to` lies
    struct RTCRay ray = ray_of(tracer, from, alb_sub(to, from), 0, 1 - 0x1p-18f);
    query plain;
    occluded(tracer->scene, &plain, &ray);
    return ray.tfar < 0;
}
