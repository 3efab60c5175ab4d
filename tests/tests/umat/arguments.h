/* The arguments of UMAT as a compiler of Fortran passes them. */
#define UMAT_ARGUMENTS                                                                                                  \
    double *stress, double *statev, double *ddsdde, double *sse, double *spd, double *scd, double *rpl, double *ddsddt, \
        double *drplde, double *drpldt, const double *stran, const double *dstran, const double *time,                  \
        const double *dtime, const double *temp, const double *dtemp, const double *predef, const double *dpred,        \
        const char *cmname, const int *ndi, const int *nshr, const int *ntens, const int *nstatv, const double *props,  \
        const int *nprops, const double *coords, const double *drot, double *pnewdt, const double *celent,              \
        const double *dfgrd0, const double *dfgrd1, const int *noel, const int *npt, const int *layer,                  \
        const int *kspt, const int *jstep, const int *kinc, unsigned long letters
